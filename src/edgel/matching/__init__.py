"""Rigid registration from edges."""
