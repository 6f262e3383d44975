"""Results as text, charts and pages: one place for numbers, one chart for terminal, report and page."""
