"""Problems of the literature, one a file: small models whose optima are known well."""
