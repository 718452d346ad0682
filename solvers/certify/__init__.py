"""What a reference value stands on."""
