"""Looking at runs: what a step costs, poses, pictures, replay."""
