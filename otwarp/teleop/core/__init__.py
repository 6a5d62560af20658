"""What a session speaks.

`frame` goes out to every sink, `commands` come back from them (`Sink` is there); `pace` says how many steps are due.
"""
