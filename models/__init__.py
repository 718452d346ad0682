"""Robots, obstacles, tasks and textbook problems, each as symbolic models."""
