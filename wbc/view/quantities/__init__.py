"""What is drawn, computed from recordings: flows of power, impacts, averages, residuals."""
