"""What the arm and its costs look like."""
