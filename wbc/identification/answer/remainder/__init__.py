"""What is left unexplained: what it looks like, and what any model could leave."""
