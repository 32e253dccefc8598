"""What scipy says of the samples in statistics.rs: python3 statistics.py (scipy 1.x)."""
import numpy as np
from scipy import stats

A = [0.31, 1.42, -0.77, 2.05, 0.11, 0.93, -1.18, 0.46, 1.71, -0.29, 0.64, 1.09]
B = [0.52, 0.37, -0.91, 1.14, 0.83, -0.46, -1.97, 0.05, 0.22, -0.33, 1.51, -0.72]
TIED = [1.0, 2.0, 2.0, 3.0, 5.0, 5.0, 5.0, 8.0, 8.0, 9.0]
OTHER = [1.0, 1.0, 3.0, 1.0, 4.0, 3.0, 7.0, 5.0, 8.0, 4.0]
LONG_A = [np.sin(1.7 * i) + 0.2 for i in range(60)]
LONG_B = [np.cos(2.3 * i) for i in range(60)]

print("exact", stats.wilcoxon(A, B, method="exact").pvalue)
print("tied", stats.wilcoxon(TIED, OTHER, method="approx", correction=True).pvalue)
print("long", stats.wilcoxon(LONG_A, LONG_B, method="approx", correction=True).pvalue)
print("mann-whitney", stats.mannwhitneyu(A, B, method="asymptotic").pvalue)
print("mann-whitney long", stats.mannwhitneyu(LONG_A, LONG_B, method="asymptotic").pvalue)
print("mann-whitney apart", stats.mannwhitneyu([1.0, 2, 3], [4.0, 5, 6], method="asymptotic").pvalue)
print("welch", stats.ttest_ind_from_stats(28.9127, 0.0230, 30, 27.9115, 0.89, 12, equal_var=False).pvalue)
print("welch paper 000", stats.ttest_ind_from_stats(1.96e4, 1.04e4, 300, 2.08e4, 1.12e4, 300, equal_var=False).pvalue)
print("quartiles", np.quantile(A, [0.25, 0.5, 0.75]), "sd", np.std(A, ddof=1), "mean", np.mean(A))

differences = np.array(A) - np.array(B)
means = sorted((differences[i] + differences[j]) / 2 for i in range(12) for j in range(i, 12))
# All signs of twelve ranks: the sums that are still outside at a level.
sums = np.bincount([sum(r for r in range(1, 13) if signs >> (r - 1) & 1) for signs in range(2**12)]) / 2**12
for level in [0.05, 0.05 / 4]:
    outer = int(np.searchsorted(np.cumsum(sums), level / 2, side="right")) - 1
    print("shift", level, np.median(means), means[outer], means[-1 - outer])
for count, of in [(0, 30), (52, 100)]:
    print("share", count, of, stats.binomtest(count, of).proportion_ci(method="wilson"))
for name, sample in [("A", A), ("LONG_A", LONG_A)]:
    print("median", name, np.median(sample), stats.quantile_test(sample, q=0.5, p=0.5).confidence_interval())
away_a, away_b = [np.abs(np.array(x) - np.median(x)) for x in (A, B)]
test = stats.ttest_ind(away_a, away_b, equal_var=False)
ends = [end / away_b.mean() for end in test.confidence_interval()]
print("spread", away_a.mean() / away_b.mean() - 1, ends, test.pvalue)
