"""Direct methods: discretise, then optimise."""
