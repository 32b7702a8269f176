"""Bundled models: one file a problem, statement only."""
