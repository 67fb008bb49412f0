"""Monte Carlo campaigns: many drawn flights, law against law, judged by bounds that hold."""
