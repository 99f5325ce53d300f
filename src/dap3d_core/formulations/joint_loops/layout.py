"""Columns of the tables of kept rows (assembly/arrays.py)."""

#: Of ``KeptRowArrays.cuts``, one kept joint in each row: its rows; place of the first one in the
#: row vectors, and among the kept ones; its first and last+1 rows of ``ends`` and of ``ways``.
ROW_COUNT, FIRST_ROW, FIRST, FIRST_END, LAST_END, FIRST_STEP, LAST_STEP, CUT_WIDTH = range(8)
#: Of ``ends``: row of ``ways``, place in D of the block, body.
END_STEP, END_BLOCK, END_BODY, END_WIDTH = range(4)
#: Of ``ways``: node; row of ``ways`` of its parent, -1 next to ground; place in ``loads``.
NODE, NEXT_STEP, LOADS, STEP_WIDTH = range(4)
#: Of ``pairs``: node; of both joints, of which the left one has the later rows, the place in
#: ``loads``, the first kept row, the rows.
PAIR_NODE, LEFT_LOADS, RIGHT_LOADS, LEFT, RIGHT, LEFT_COUNT, RIGHT_COUNT, PAIR_WIDTH = range(8)
#: Of ``profile``: first row that a row couples with; place of column 0 of the row in ``matrix``.
COUPLED, PLACE, PROFILE_WIDTH = range(3)

#: Of ``settings``: 0.0 where rows are independent, else the part of a row's square that is
#: its compliance; that of the present factors, which is less where passes did not converge.
PART_OF_ROW, PART_OF_FACTORS = range(2)
