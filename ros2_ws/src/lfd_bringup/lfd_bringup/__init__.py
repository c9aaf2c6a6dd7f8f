"""Launch files, parameter files and the one-process replay."""
