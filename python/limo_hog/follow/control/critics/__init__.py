"""What a rollout costs: a critic a file, each with one weight; `planner.Planner` sums them."""
