"""Drives in and out: bag player, importers, fault injection, generated drives, evaluation, reports."""
