"""The paper, reproduced: every table and figure computed anew and set beside the published one, as one report.

In come the shipped scenes, out comes a folder with `report.html`, figures and numbers. Open `runner` first; floor plan,
each file importing only from those above it:

    item              figures of the paper and ours, and what an item is asked for and returns
    measures          R², RMSE and the like by the paper's definitions; statistics of two groups of ten
    drawing           looks of figures; CSV files
    items             the items themselves, a module each
    registry          all of them in one table
    numbering         figures and tables of the report by number
    code              commit and digest of what computes
    parts             the calls in which an item was computed, their times and machines
    store             the folder
    sheet, report     the page in HTML, numbers as JSON and CSV
    document          the page in Markdown
    runner            all of these together: `reproduce`
"""
