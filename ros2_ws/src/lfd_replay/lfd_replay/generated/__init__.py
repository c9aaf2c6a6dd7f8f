"""Generated drives: leads, a follower, and the sensors of a car."""
