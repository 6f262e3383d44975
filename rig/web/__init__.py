"""The workbench: pages in a browser that do what the command line does, by the same functions.

    server     listens, and lets in who has the token
    guard      the token of the user; token, host and origin of every request and websocket
    frame      what all pages share: navigation, the run under way, light and dark, keys
    desk       state that all pages share: open data, models with their added effects, reports
    pages      one a file, in pages/
    figures    pictures as values that Plotly draws, in figures/

No page computes: what is asked for is done by `calibrations`, `procedures` and the rest of `rig`, off the event loop.
"""
