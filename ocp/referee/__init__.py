"""The referee: integrate the controls until the cost holds, then judge."""
