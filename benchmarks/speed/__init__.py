"""What a step of MPC costs, as ratios in one run."""
