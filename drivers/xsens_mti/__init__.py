"""A motion tracker Xsens MTi."""
