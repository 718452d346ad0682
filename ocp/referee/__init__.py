"""The referee: integrate the controls until the cost no longer changes, then judge."""
