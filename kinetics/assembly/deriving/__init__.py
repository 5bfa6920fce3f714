"""From a rule book to every structure, every reaction, and the reaction network."""
