"""Many sensors: common effects of a batch, errors of its rigs, and pooling of sensors with their siblings."""
