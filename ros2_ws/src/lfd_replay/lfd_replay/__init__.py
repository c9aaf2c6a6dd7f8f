"""Drives in and out: player, importers, faults, generated drives, evaluation, reports."""
