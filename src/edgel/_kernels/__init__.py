"""Compile kernels and run them, eight lanes in step, and the small linear algebra they share."""
