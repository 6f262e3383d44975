"""Import of foreign files: columns are renamed, units are converted, doubtful units are reported."""
