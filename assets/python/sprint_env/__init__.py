"""Environments in Python for the program `sprint`, and sprint's own environment, House, for Python.

`python -m sprint_env gym ID` serves an environment to `sprint`.
"""
