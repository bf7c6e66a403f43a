"""Result files, and their figures, pages and exports."""
