"""Analysis from result files: what a tack test measured, what its hysteresis is made of, and what others predict.

    from pgfmd.analysis.summary import analyse
    analysis = analyse("out/hex-tack", twin="out/hex-twin")      # analysis.record, analysis.table

Nothing here needs MPI, and nothing looks into a running program: folders of results and measured curves are all it
reads.
"""
