"""What single effects change of the residual: columns of a regression, and of derivatives."""
