"""A calibration certificate: its content as frozen values, its figures, and its forms for people and for machines.

content    who, what, conditions, figures, decisions; the JSON document
results    figures of a fit: expanded uncertainties, their budget and its check by simulation, values as found
terms      names of results by IEEE standards, and their units in SI
sections   headings, facts and tables: one text for HTML and PDF
pages      HTML and PDF, for people
dcc        PTB's Digital Calibration Certificate, for machines
"""
