"""The receding-horizon driver: plan, check, apply, measure; never an input nobody answers for."""
