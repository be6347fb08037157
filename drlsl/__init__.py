"""Safe reinforcement learning for highway driving, shielded by readable Prolog rules."""
