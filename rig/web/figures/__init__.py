"""Pictures of the workbench as plain values that Plotly draws: one a file, each a function `figure(...)`.

    measurement   output beside the model
    residual      what the model leaves, against any column, with the curve of an effect that is considered
    failure       the map of where the model fails
    motion        output beside model over a few periods, and what is left over one
    record        a still record over time
    averaging     the Allan deviation of a still record beside the model
    spectrum      its spectrum beside the model
    beside        two runs: how their parameters differ, what one model leaves of both, what differs itself
    sensed        units of a still record: the output's own, or those of what is sensed
    waterfall     the error falling as effects are added, down to the noise floor
    series        values of a run over time, thinned
    life          one quantity over a sensor's calibrations, its drift, what is allowed
    chart         its control charts
    prefixed      units for people, with the prefix by which numbers read best

Those of a model show the same rows in the same order (`rows.Shown`), so that a selection in one holds in all. Colours
of text and grid are the page's (`workbench.css`), which knows whether it is dark.
"""
