"""The workbench: pages in a browser that do what the command line does, by the same functions.

    server     listens, and lets in who has the token
    guard      the token of the user; token, host and origin of every request and websocket
    frame      what all pages share: navigation, the run under way, light and dark, keys
    desk       state that all pages share: open data, models with their added effects, reports
    parts      boxes, tables, messages
    pictures   charts that Plotly draws, with their downloads
    pages      one a file, in pages/

No page computes. It calls `calibrations`, `procedures` and the rest of `rig`, outside the event loop.
"""
