"""Problems with linear dynamics and quadratic cost: recognise, read, discretise."""
