"""Structure first, names second: where in the signal chain something acts, found with functions of unknown form.

bases       smooth functions whose coefficients have one prior variance
form        a free form: a basis, what drives it, and how it enters the chain; kept in model files
effect      free forms of one place as an effect of a model
place_names places, and the effects of the catalogue at each
poses       what the search reads of a table
chain       signals along the chain at given coefficients, and their derivatives
components  what may act at a place: a free form, or the form of a catalogue effect
places      all components that a table can show
reml        sizes by restricted maximum likelihood
search      which components act
naming      which catalogue effects are the causes within a place
rivals      which causes at other places explain a place as well
geometry    which misalignment and stage errors the linear parts need
"""
