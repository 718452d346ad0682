"""Problems one after another: their description, one problem made of them, and the way back."""
