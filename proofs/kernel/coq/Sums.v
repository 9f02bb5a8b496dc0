(** Assignments as changes: where no fluent is assigned and changed once more at a time, an assignment is an increase by what
    is missing, so that a fluent is a sum of changes. States that change so follow a run of their own, for every
    schedule; the formulas are about it, and it is the course if effects agree and mutex time points are apart. *)

Require Import Reals QArith Qreals List Bool Lra Lia Arith.
Require Import Spec States Closed.
Import ListNotations.
Open Scope R_scope.

Section Sums.
Variable P : plan.
Variable g t : nat -> R.

(** By how much an effect changes its fluent. *)
Definition gain (s : state) (w : effect) : R :=
  match makes w with
  | Increase _ e => amount g t s e
  | Assign f e => amount g t s e - value s f
  | _ => 0
  end.

Definition summed (time : R) (s : state) : state :=
  let fired := filter (fires g t s time) (effects P) in
  {| holds := holds (updated P g t time s);
     value := fun f => value s f + sum (fun w => if on f w then gain s w else 0) fired |}.

Lemma gain_same s s' w : same s s' -> gain s w = gain s' w.
Proof.
  intros S. unfold gain. destruct (makes w); auto using amount_same.
  rewrite (amount_same _ _ _ _ _ S). destruct S as [_ V]. now rewrite V.
Qed.

Lemma fires_same s s' time w : same s s' -> fires g t s time w = fires g t s' time w.
Proof. intros S. unfold fires. destruct Req_EM_T; auto. now apply sat_same. Qed.

Lemma summed_same time s s' : same s s' -> same (summed time s) (summed time s').
Proof.
  intros S. split; [apply (updated_same P g t time s s' S)|]. intros f. unfold summed. cbn [value].
  rewrite (filter_ext _ _ (fun w => fires_same s s' time w S)). f_equal; [apply S|].
  apply sum_ext. intros w _. destruct (on f w); auto. now apply gain_same.
Qed.

Lemma summed_idle time s : (forall p, In p (happenings P) -> t p <> time) -> same (summed time s) s.
Proof.
  intros N. split; [apply (updated_idle P g t time s N)|]. intros f. unfold summed. cbn [value].
  rewrite sum_filter, sum_zero; [lra|]. intros w I. unfold fires. destruct Req_EM_T as [E|E]; auto.
  exfalso. apply (N (point w)); auto. unfold happenings. apply in_or_app. left. now apply in_map.
Qed.

(** The run of sums, and what fires in it. *)
Definition sum_before : R -> state := history P g t summed (moments P t).
Definition sum_after (time : R) : state := summed time (sum_before time).

Lemma sum_runs : runs P g t summed sum_before sum_after.
Proof. apply run_exists. intros time s. apply summed_idle. Qed.

Definition fired (w : effect) : bool := sat g t (sum_before (t (point w))) (guard w).
Definition gained (w : effect) : R := gain (sum_before (t (point w))) w.

(** It has the closed forms. *)
Definition now_before : R -> state := closed P g t fired gained true.
Definition now_after : R -> state := closed P g t fired gained false.

Theorem sum_closed time : same (sum_before time) (now_before time) /\ same (sum_after time) (now_after time).
Proof.
  apply (run_unique P g t (moved P t fired gained)); [apply moved_same | | apply closed_runs].
  destruct sum_runs as [A B C]. constructor; auto. intros u. apply same_trans with (summed u (sum_before u)); auto.
  assert (F : filter (fires g t (sum_before u) u) (effects P) =
    filter (fun w => if Req_EM_T (t (point w)) u then fired w else false) (effects P)).
  { apply filter_ext. intros w. unfold fires, fired. destruct Req_EM_T; auto. now subst. }
  unfold summed, moved, updated. rewrite F. split; simpl; auto. intros f. f_equal. rewrite !sum_filter.
  apply sum_ext. intros w _. unfold gained. destruct Req_EM_T; auto. now subst.
Qed.

(** ** Where effects agree *)

(** Two changes of one fluent, one of them an assignment. *)
Definition clash (v w : effect) : bool :=
  match makes v, makes w with
  | Assign f _, Assign h _ | Assign f _, Increase h _ | Increase f _, Assign h _ => Nat.eqb f h
  | _, _ => false
  end.

Fixpoint calm (l : list effect) : Prop :=
  match l with [] => True | v :: rest => (forall w, In w rest -> clash v w = false) /\ calm rest end.

Lemma untouched s f l : (forall w, In w l -> on f w = false) ->
  (forall old, fold_left (assigned g t s f) l old = old) /\ sum (increased g t s f) l = 0 /\
  sum (fun w => if on f w then gain s w else 0) l = 0.
Proof.
  intros H. split; [|split].
  - induction l as [|w l IH]; simpl; intros old; auto. rewrite IH by (intros; apply H; now right).
    pose proof (H w (or_introl eq_refl)) as W. unfold on, target in W. unfold assigned.
    destruct (makes w); auto. now rewrite W.
  - apply sum_zero. intros w I. apply H in I. unfold on, target in I. unfold increased. destruct (makes w); auto. now rewrite I.
  - apply sum_zero. intros w I. now rewrite (H w I).
Qed.

Lemma only_increases s f l : (forall w, In w l -> match makes w with Assign h _ => Nat.eqb h f = false | _ => True end) ->
  (forall old, fold_left (assigned g t s f) l old = old) /\
  sum (increased g t s f) l = sum (fun w => if on f w then gain s w else 0) l.
Proof.
  intros H. split.
  - induction l as [|w l IH]; simpl; intros old; auto. rewrite IH by (intros; apply H; now right).
    pose proof (H w (or_introl eq_refl)) as W. unfold assigned. destruct (makes w); auto. now rewrite W.
  - apply sum_ext. intros w I. apply H in I. unfold increased, on, target, gain. destruct (makes w); auto. now rewrite I.
Qed.

Lemma calm_sum s f l : calm l -> fold_left (assigned g t s f) l (value s f) + sum (increased g t s f) l =
  value s f + sum (fun w => if on f w then gain s w else 0) l.
Proof.
  induction l as [|v l IH]; [reflexivity|]. intros [C D]. destruct (on f v) eqn:O.
  - unfold on, target in O. destruct (makes v) as [a | a | h e | h e] eqn:M; try easy;
    apply Nat.eqb_eq in O; subst h.
    + destruct (only_increases s f l) as [A B].
      { intros w I. apply C in I. unfold clash in I. rewrite M in I. destruct (makes w); auto. now rewrite Nat.eqb_sym. }
      simpl. unfold assigned at 2, increased at 1, on at 1, target, gain at 1. rewrite M, Nat.eqb_refl, A, B. lra.
    + destruct (untouched s f l) as [A [B Z]].
      { intros w I. apply C in I. unfold clash in I. rewrite M in I. unfold on, target. destruct (makes w); auto;
        now rewrite Nat.eqb_sym. }
      simpl. unfold assigned at 2, increased at 1, on at 1, target, gain at 1. rewrite M, Nat.eqb_refl, A, B, Z. lra.
  - specialize (IH D). simpl. rewrite O. unfold on, target in O. unfold assigned at 2, increased at 1.
    destruct (makes v); rewrite ?O; lra.
Qed.

Lemma calm_update time s : calm (filter (fires g t s time) (effects P)) -> same (updated P g t time s) (summed time s).
Proof. intros C. split; simpl; auto. intros f. now apply calm_sum. Qed.

(** *** Agreement at time points, and separation of these *)

(** Timed initial literals are not mutex: that two of them which change one fluent are at different times is looked up. *)
Definition earlier_by_edges (p q : nat) : bool :=
  existsb (fun e => match e with (a, b, w) => Nat.eqb a p && Nat.eqb b 0 && match w with Num x =>
    existsb (fun d => match d with (a', b', w') => Nat.eqb a' 0 && Nat.eqb b' q && match w' with Num y =>
      negb (Qle_bool y (- x)) | _ => false end end) (edges P) | _ => false end end) (edges P).

Lemma earlier_by_edges_true p q : kept P g t -> earlier_by_edges p q = true -> t p < t q.
Proof.
  intros [Z K] H. unfold earlier_by_edges in H. apply existsb_exists in H as [[[a b] w] [I H]].
  rewrite !andb_true_iff, !Nat.eqb_eq in H. destruct H as [[-> ->] H]. destruct w as [x| | | | |]; try easy.
  apply existsb_exists in H as [[[a' b'] w'] [J H]].
  rewrite !andb_true_iff, !Nat.eqb_eq in H. destruct H as [[-> ->] H]. destruct w' as [y| | | | |]; try easy.
  apply negb_true_iff in H. apply K in I, J. simpl in I, J. assert (L : Q2R (- x) < Q2R y).
  { apply Rnot_le_lt. rewrite <- Qle_R. congruence. }
  rewrite Q2R_opp in L. lra.
Qed.

Definition is_timed (p : nat) : bool := existsb (Nat.eqb p) (timed P).

Definition timed_apart : bool :=
  let l := filter (fun w => is_timed (point w)) (effects P) in
  forallb (fun v => forallb (fun w => negb (clash v w) || Nat.eqb (point v) (point w) ||
    earlier_by_edges (point v) (point w) || earlier_by_edges (point w) (point v)) l) l.

Lemma in_mutex p q u v : In (p, u) (uses P) -> In (q, v) (uses P) -> harms u v = true -> p <> q ->
  is_timed p && is_timed q = false -> In (Nat.min p q, Nat.max p q) (mutex P).
Proof.
  intros U V H N T. unfold mutex. apply in_flat_map. exists (p, u). split; auto. apply in_flat_map.
  exists (q, v). split; auto. unfold is_timed in T. rewrite H, T. apply Nat.eqb_neq in N. rewrite N. now left.
Qed.

Lemma changes_in_uses w u : In w (effects P) -> In u (changed (makes w)) -> In (point w, u) (uses P).
Proof.
  intros I U. unfold uses. apply in_app_iff. right. apply in_app_iff. left. apply in_flat_map. exists w. split; auto.
  apply in_map, in_app_iff. now right.
Qed.

Lemma clash_apart epsilon v w : kept P g t -> timed_apart = true ->
  (forall p q, In (p, q) (mutex P) -> apart epsilon t p q) -> In v (effects P) -> In w (effects P) ->
  clash v w = true -> point v <> point w -> t (point v) <> t (point w).
Proof.
  intros K T M V W C N. destruct (is_timed (point v) && is_timed (point w)) eqn:B.
  - apply andb_true_iff in B as [B1 B2]. unfold timed_apart in T. rewrite forallb_forall in T.
    assert (T' := T v). rewrite filter_In, forallb_forall in T'. specialize (T' (conj V B1) w).
    rewrite filter_In in T'. specialize (T' (conj W B2)). clear T. rename T' into T. rewrite C in T. apply Nat.eqb_neq in N. rewrite N in T. simpl in T.
    apply orb_true_iff in T as [T|T]; apply (earlier_by_edges_true _ _ K) in T; lra.
  - assert (X : exists u x, In u (changed (makes v)) /\ In x (changed (makes w)) /\
      (harms u x = true \/ harms x u = true)).
    { unfold clash in C. destruct (makes v), (makes w); try easy; (do 2 eexists); (split; [now left|]); (split; [now left|]);
      simpl; rewrite ?C; auto. rewrite Nat.eqb_sym in C. auto. }
    destruct X as [u [x [U [X [H|H]]]]].
    + pose proof (in_mutex _ _ _ _ (changes_in_uses v u V U) (changes_in_uses w x W X) H N B) as I.
      destruct (M _ _ I) as [_ A]. destruct (Nat.min_spec (point v) (point w)) as [[_ E]|[_ E]],
        (Nat.max_spec (point v) (point w)) as [[_ F]|[_ F]]; rewrite E, F in A; try lia; auto.
    + rewrite andb_comm in B.
      pose proof (in_mutex _ _ _ _ (changes_in_uses w x W X) (changes_in_uses v u V U) H (not_eq_sym N) B) as I.
      destruct (M _ _ I) as [_ A]. destruct (Nat.min_spec (point w) (point v)) as [[_ E]|[_ E]],
        (Nat.max_spec (point w) (point v)) as [[_ F]|[_ F]]; rewrite E, F in A; try lia; auto.
Qed.

Lemma agreed_calm epsilon (before : R -> state) time : kept P g t -> timed_apart = true ->
  (forall p q, In (p, q) (mutex P) -> apart epsilon t p q) ->
  (forall p c, In (AtPoint p c) (agreements (effects P)) -> sat g t (before (t p)) c = true) ->
  calm (filter (fires g t (before time) time) (effects P)).
Proof.
  intros K T M A. assert (E : forall w, In w (effects P) -> In w (effects P)) by auto. revert E A.
  generalize (effects P) at 1 3 4 as l. induction l as [|v l IH]; [easy|]. intros E A.
  assert (R : calm (filter (fires g t (before time) time) l)).
  { apply IH; [intros; apply E; now right|]. intros p c I. apply A. simpl. apply in_app_iff. now right. }
  simpl. destruct (fires g t (before time) time v) eqn:F; auto. split; auto. intros w I. apply filter_In in I as [I G].
  apply not_true_iff_false. intros C. unfold fires in F, G.
  destruct (Req_EM_T (t (point v)) time) as [Tv|]; [|easy]. destruct (Req_EM_T (t (point w)) time) as [Tw|]; [|easy].
  destruct (Nat.eq_dec (point v) (point w)) as [D|D].
  - assert (X : sat g t (before (t (point v))) (Not (And (guard v) (guard w))) = true).
    { apply A. simpl. apply in_app_iff. left. apply (in_map (fun w => AtPoint (point v) (Not (And (guard v) (guard w))))), filter_In.
      split; auto. unfold contrary. apply Nat.eqb_eq in D. now rewrite D. }
    rewrite Tv in X. simpl in X. rewrite F, G in X. easy.
  - apply (clash_apart epsilon v w) in D; auto; [congruence | apply E; now left | apply E; now right].
Qed.

(** What is a course is the run of sums, and the other way round, where effects agree and mutex time points are apart. *)
Theorem sum_is_course epsilon : kept P g t -> timed_apart = true ->
  (forall p q, In (p, q) (mutex P) -> apart epsilon t p q) ->
  (forall p c, In (AtPoint p c) (agreements (effects P)) -> sat g t (sum_before (t p)) c = true) ->
  course P g t sum_before sum_after.
Proof.
  intros K T M A. apply course_runs. destruct sum_runs as [B C D]. constructor; auto. intros time.
  apply same_trans with (summed time (sum_before time)); auto. apply same_sym, calm_update. now apply (agreed_calm epsilon).
Qed.

Theorem course_is_sum epsilon before after : kept P g t -> timed_apart = true ->
  (forall p q, In (p, q) (mutex P) -> apart epsilon t p q) -> course P g t before after ->
  (forall p c, In (AtPoint p c) (agreements (effects P)) -> sat g t (before (t p)) c = true) ->
  forall time, same (before time) (sum_before time) /\ same (after time) (sum_after time).
Proof.
  intros K T M C A. apply (run_unique P g t summed); [intros; now apply summed_same | | apply sum_runs].
  apply course_runs in C. destruct C as [B C D]. constructor; auto. intros time.
  apply same_trans with (updated P g t time (before time)); auto. apply calm_update. now apply (agreed_calm epsilon).
Qed.

End Sums.
