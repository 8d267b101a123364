"""Evidence for an application: campaigns, their analysis, and one page and document about them."""
