"""Analysis of result files: the numbers of a tack test, the parts of its hysteresis, and other models.

    from pgfmd.analysis.summary import analyse
    analysis = analyse("out/hex-tack", twin="out/hex-twin")      # analysis.record, analysis.table

Nothing here needs MPI or a running program. It only reads results folders and measured curves.
"""
