"""Effects of one line of arithmetic: parsed and walked, never evaluated by Python."""
