"""Pictures of a model beside its data: one a file, each a function `picture(...)` that returns a figure.

    measurement   output beside the model, a curve for each inclination
    residual      what the model leaves, against angle, time and temperature
    failure       a map of where the model fails
    candidate     what an effect would change, drawn through what is left
    waterfall     the error falling as effects are added, down to the noise floor
    album         all pictures that a discovery calls for, with captions

`save.save` writes one as PNG or SVG: the same figure gives the same bytes.
"""
