"""What studies show: tables, plots and reports as plain data, and the pages, pictures and progress made of them."""
