"""The files of a bag: MCAP record by record, and what says of them what they hold."""
