"""The aircraft model against everything published about the XV-15: declared checks, their run, plots and reports."""
