"""A calibration certificate: what it says as values, its figures, and how it is written for people and for machines.

content      all that a certificate says, as frozen values
results      a fit's figures: expanded uncertainties, what they are made of, as found, decisions
monte_carlo  the same uncertainties by the propagation of distributions
decision     conformity with a limit under uncertainty
sections     the certificate as headings, facts and tables: one text for HTML and PDF
html, pdf    for people
dcc          for machines: PTB's Digital Calibration Certificate
si           units of results as the D-SI has them
"""
