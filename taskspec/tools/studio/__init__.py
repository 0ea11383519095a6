"""The studio: specs are written in the browser, with mathematics, figure, scores and episodes beside them.

`server` admits one page, `processes` answers its questions in processes that can be ended, `answers` and `episodes` hold what
is answered, and `folder` the files. Starlette, uvicorn and websockets are imported here.
"""
