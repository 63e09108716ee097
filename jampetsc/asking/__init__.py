"""How a job is asked for: its parameters, the kinds of their values, and what several of them make."""
