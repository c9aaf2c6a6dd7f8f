"""Recordings of other people's cars: CAN, messages and data sets become samples."""
