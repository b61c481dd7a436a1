"""What is said in the end: verdict, findings, comparison, ranking."""
