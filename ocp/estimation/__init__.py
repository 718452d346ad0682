"""What data tell of constants and starts: residuals, covariance, standard errors."""
