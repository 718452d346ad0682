"""Real robots: descriptions, kinematics, dynamics and motions."""
