"""What the robust profile must show, measured for both profiles."""
