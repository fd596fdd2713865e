"""What a diagnosis found, as files a person and a program understand: JSON, figures, a page."""
