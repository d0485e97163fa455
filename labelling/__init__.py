"""Labels made by people: a page to label pictures on, and what operators' decisions tell about pictures."""
