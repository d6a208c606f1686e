"""Many cases on many processes or machines: which key a case has, where it runs, what of it is kept."""
