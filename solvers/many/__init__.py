"""Many runs of one problem at once: what is asked, how it is solved, what comes back."""
