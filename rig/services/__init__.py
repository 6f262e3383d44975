"""The questions that command line and workbench both ask of data and models."""
