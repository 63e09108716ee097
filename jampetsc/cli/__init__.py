"""What words of the command line mean, and the texts that answer them. No command is imported here."""
