from hypothesis import settings

# A busy machine takes longer over an example; that says nothing about a law.
settings.register_profile("no_deadline", deadline=None)
settings.load_profile("no_deadline")
